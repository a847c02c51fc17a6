"""The blind study: worlds with a concealed effect, the tool run on each without the label, labels opened afterwards."""
