"""Results leave here, as HTML, tables and figures; the only room that imports a plotting library."""
