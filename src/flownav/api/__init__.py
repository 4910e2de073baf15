"""The public Python API that `import flownav` offers: fly, replay, identify, campaign, load and what they give."""
