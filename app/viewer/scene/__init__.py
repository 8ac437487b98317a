"""Scene in three dimensions: what is drawn, and the drag that pushes the robot.

scene         nodes of one robot's scene, its ground, lights and camera
layers        table of all layers
frame         input of the layers: snapshot, history, what is shown
proportions   size and mass of the robot, which the drawings follow
robot         meshes of the robot: `robot_mesh` decimates them, `joints` moves them
footprints    soles on the ground, past and planned
supports      support polygon, margin, foothold regions, active bounds
points        CoM, CoP, true CoP, capture point
velocities    reference and velocity of the CoM
pushes        the last push and the preview of the next one
drag_push     push by a drag of the robot's body
primitives    polygons, dots, lines and arrows that the layers share
"""
