"""A set of information matrices as graybox hands it over, whitened by its mean: what rivals solve."""
import numpy as np


def whitened(packed):
    """Matrices [Q x d x d] of packed lower triangles, with the rows and columns of a triangle."""
    count, d = len(packed), int(np.sqrt(2 * packed.shape[1]))
    rows, columns = np.tril_indices(d)
    full = np.zeros((count, d, d))
    full[:, rows, columns] = full[:, columns, rows] = packed
    root = np.linalg.inv(np.linalg.cholesky(full.mean(axis=0)))
    return root @ full @ root.T, rows, columns
