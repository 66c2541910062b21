"""What becomes of outcomes: a summary, a page with drawings, the documents."""
