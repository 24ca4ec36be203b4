"""The sums that the back end of SLAM minimises, for Ceres, where every line is an unknown."""

import numpy as np
import pytest

pyceres = pytest.importorskip("pyceres", reason="needs pip install 'lrf3d[ceres]'")


class EdgeCost(pyceres.CostFunction):
    """The whitened error of a relative pose between two poses x, y, theta."""

    def __init__(self, measured, information):
        super().__init__()
        self.measured, self.root = measured, np.linalg.cholesky(information).T
        self.set_num_residuals(3)
        self.set_parameter_block_sizes([3, 3])

    def Evaluate(self, parameters, residuals, jacobians):
        (x, y, turn), (u, v, end) = parameters
        cos, sin = np.cos(turn), np.sin(turn)
        ahead, left = cos * (u - x) + sin * (v - y), cos * (v - y) - sin * (u - x)
        error = np.array([ahead, left, end - turn]) - self.measured
        error[2] = np.angle(np.exp(1j * error[2]))
        residuals[:] = self.root @ error
        if jacobians is not None:
            back = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
            by_first = -back
            by_first[:2, 2] = left, -ahead
            for jacobian, derivative in zip(jacobians, (by_first, back), strict=True):
                if jacobian is not None:
                    jacobian[:] = (self.root @ derivative).ravel()
        return True


class PointCost(pyceres.CostFunction):
    """Distances of points at a pose x, y, theta to a line, by its normal's angle and offset."""

    def __init__(self, points, weight):
        super().__init__()
        self.points, self.weight = points, weight
        self.set_num_residuals(len(points))
        self.set_parameter_block_sizes([3, 2])

    def Evaluate(self, parameters, residuals, jacobians):
        turn, (angle, offset) = parameters[0][2], parameters[1]
        cos, sin = np.cos(turn), np.sin(turn)
        placed = self.points @ np.array([[cos, sin], [-sin, cos]])
        normal = np.array([np.cos(angle), np.sin(angle)])
        across = np.array([-normal[1], normal[0]])
        here = placed + parameters[0][:2]
        residuals[:] = self.weight * (here @ normal - offset)
        if jacobians is not None:
            ones = np.ones(len(placed))
            turned = placed @ np.array([[0.0, 1.0], [-1.0, 0.0]])
            by_pose = np.column_stack([normal[0] * ones, normal[1] * ones, turned @ normal])
            by_line = np.column_stack([here @ across, -ones])
            for jacobian, derivative in zip(jacobians, (by_pose, by_line), strict=True):
                if jacobian is not None:
                    jacobian[:] = (self.weight * derivative).ravel()
        return True


class Problem:
    """A sum over poses and lines, minimised by Ceres; the first pose is held."""

    def __init__(self, poses, lines=()):
        self.poses, self.lines = [np.array(pose) for pose in poses], [np.array(a) for a in lines]
        self.problem = pyceres.Problem()

    def add_edges(self, edges, robust_scale):
        """Edges of a pose graph, with Cauchy's loss where they may be wrong."""
        for first, second, measured, information, robust in zip(
            edges.first, edges.second, edges.measured, edges.information, edges.robust, strict=True
        ):
            loss = pyceres.CauchyLoss(robust_scale) if robust else pyceres.TrivialLoss()
            blocks = [self.poses[first], self.poses[second]]
            self.problem.add_residual_block(EdgeCost(measured, information), loss, blocks)

    def add_points(self, key, line, points, weight):
        """Points on the pose of a key scan, which lie on a line."""
        blocks = [self.poses[key], self.lines[line]]
        self.problem.add_residual_block(PointCost(points, weight), pyceres.TrivialLoss(), blocks)

    def least(self):
        """The least sum; Ceres counts half of it."""
        self.problem.set_parameter_block_constant(self.poses[0])
        options = pyceres.SolverOptions()
        options.linear_solver_type = pyceres.LinearSolverType.DENSE_QR
        options.max_num_iterations = 200
        options.function_tolerance = options.gradient_tolerance = 1e-16
        options.parameter_tolerance = 1e-14
        summary = pyceres.SolverSummary()
        pyceres.solve(options, self.problem, summary)
        return 2.0 * summary.final_cost
