"""The ground floor: the words that every part speaks. Imports no other part."""
