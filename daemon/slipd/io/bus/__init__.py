"""The ZeroMQ side of the daemon: publisher, request server, access lists and runtime directory."""
