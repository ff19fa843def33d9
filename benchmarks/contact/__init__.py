"""Scenes with contact: error against seconds of msahl, Exudyn, MuJoCo and Drake."""
