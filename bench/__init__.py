"""What a person uses: commands, planning, runs, recordings, identification, reports."""
