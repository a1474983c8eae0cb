"""Synthetic traverses with ground truth."""
