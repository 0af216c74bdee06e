"""Speed and accuracy of hydroctl beside its peers: `python -m benchmarks [job ...]
[--smallest]`."""
