"""The plant: the body that really moves when the joints are driven, and the stabiliser that keeps it near the model.

`plant` defines what a plant is and holds the ideal one; `mujoco_model` and `mujoco_plant` are contact physics;
`stabilizer` closes the loop between the measured body and the model's motion; `driver` drives the joints of one body.
"""
