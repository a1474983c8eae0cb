"""What recorded sound holds beside contact sound: lines, wind, resonances; located, named, subtracted, shown."""
