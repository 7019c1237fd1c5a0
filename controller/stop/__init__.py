"""The way to a stop that nothing else uses: a word in shared memory, a process that writes it, a loop that answers."""
