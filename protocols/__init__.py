"""Ready protocols, benches and pads as YAML; data, shipped with the packages."""
