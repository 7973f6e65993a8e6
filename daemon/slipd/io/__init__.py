"""What touches the machine: ports, sockets, files, the terminal, systemd."""
