"""Names of what a learning run leaves in its folder. Without PyTorch: who reads a run may not have it."""

LABELS, RECORD, NOVICE = "labels.lira", "run.jsonl", "novice.safetensors"
