"""What every room uses: errors, files, interrupts, processes and words."""
