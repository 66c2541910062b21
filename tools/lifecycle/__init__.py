"""The life of all processes around one robot: started together, watched, started again, stopped together."""
