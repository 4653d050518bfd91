"""What runs show: events, gaps, disagreement, cost, and savings against periodic broadcasts.

It imports `laws` and what is below.
"""
