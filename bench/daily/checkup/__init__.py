"""What `padbench doctor` measures, one idea a file; each judges its own figures in plain words."""
