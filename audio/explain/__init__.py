"""What recorded sound holds besides contact sound: lines, wind, resonances; located, named, subtracted, shown."""
