"""The helicopter: actuators, flapping and thrust, forces and torques, rigid body (paper equations 1-11).

`loading` reads a vehicle file into `parameters`, `helicopter` holds the state and its derivative, `trim` and
`linearize` find the hover and the reduced models about it, `paper_model` carries the matrices that the paper prints.
"""
