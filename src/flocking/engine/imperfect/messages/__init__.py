"""What agents know by messages: samples, what has arrived, and links that follow, which sampled and delayed share."""
