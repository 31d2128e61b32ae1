"""What every command and record needs: files, processes, text, numbers and progress."""
