"""What benchmarks share: processes of their own, and made-up inputs."""
