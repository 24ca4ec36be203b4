"""The paper's mapper: section 3 of Teslić et al. to the letter."""
