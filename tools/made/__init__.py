"""Made indoor flights on which the navigator is judged, by two generators that share nothing but this folder's seeds.

Neither knows flownav's filter: they are written from how small drones and their sensors behave.
"""
