"""A synthetic proving ground: sites of several soils, a vehicle that learns them, planners that drive on them."""
