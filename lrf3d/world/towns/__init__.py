"""Towns: buildings from OpenStreetMap and GeoJSON."""
