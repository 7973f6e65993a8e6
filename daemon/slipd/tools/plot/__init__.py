"""One recording as a picture: what slipd reports over time, as a page or a PNG."""
