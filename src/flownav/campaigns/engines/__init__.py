"""Where a campaign's flights are flown: on this machine's cores, on a cluster, on a GPU."""
