"""Where is the camera, how is it oriented, and how well do four landmarks tell?"""

import numpy as np

import losnav as ln

landmarks = np.array([[32.5, 0.0, 0.0], [0.0, 30.0, 0.0], [-31.5, 0.0, 0.0], [0.0, -30.5, 0.0]])  # m
sigma = 2e-5  # rad, 1-sigma of each direction

# Directions a camera 500 m above the landmarks would measure.
rng = np.random.default_rng(1)
los = ln.predict_los(landmarks, position=[-50.0, 50.0, 500.0], mrp=[0.09, -0.04, 0.03])
los += sigma * rng.standard_normal(los.shape)

solution = ln.solve_pose(landmarks, los, sigma=sigma)  # no first guess needed
deviation = np.sqrt(np.diag(solution.covariance))

print("position     ", solution.position.round(2), "m")
print("  1-sigma    ", deviation[:3].round(2), "m")
print("attitude MRP ", solution.mrp.round(5))
print("  1-sigma    ", np.degrees(deviation[3:]).round(3), "deg about body axes")
print("chi2         ", round(solution.chi2, 2), "for", solution.dof, "degrees of freedom")
print("converged    ", solution.converged)
print(solution.observability)
