"""Pictures of runs: plots for papers, films, and a gallery."""
