"""The editor: a user corrects a plan in the browser, and places a robot in it."""
