"""Tests of symmetries that no fish can break: what they find needs no model of the fish."""
