"""Live messages for viewers that people already have: Foxglove, Lichtblick, PlotJuggler."""
