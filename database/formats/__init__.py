"""The formats that other programs read, one module each, which registers its exporter (`exporters`)."""
