/** Rigid motions as rows of 4 x 4 matrices, as the results have them. */

export const IDENTITY = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]];
export const times = (a, b) => a.map((row) => b[0].map((_, k) => row.reduce((sum, part, n) => sum + part * b[n][k], 0)));
export const moved = (matrix, p) => matrix.slice(0, 3).map((row) => row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]);

/** Of a motion or a reflection: what turns is orthogonal. */
export function inverse(matrix) {
  const turned = [0, 1, 2].map((k) => [matrix[0][k], matrix[1][k], matrix[2][k]]);
  const shift = [matrix[0][3], matrix[1][3], matrix[2][3]];
  return [...turned.map((row) => [...row, -row.reduce((sum, part, k) => sum + part * shift[k], 0)]), [0, 0, 0, 1]];
}
