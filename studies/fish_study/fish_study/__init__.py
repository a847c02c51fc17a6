"""The blind study: scenarios with a concealed effect, the tool run on each without the label, labels opened afterwards."""
