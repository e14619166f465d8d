"""Pictures made from results: what was found is sampled here, and nothing is looked for."""
