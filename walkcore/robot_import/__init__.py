"""From a URDF to a robot file: the legs, soles, posture and limits of a biped, measured on its model."""
