"""The public Python API, which `import flownav` offers by name: fly, replay, identify, campaign, load and what they give."""
