"""What every node does alike."""
