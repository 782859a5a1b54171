/** The named views of a part, the same on the page and in the report (pipeline/report/render.py). */

/** From which side the eye looks at the part, in the frame of the design. */
export const DIRECTIONS = { '+z': [0, 0, 1], '−z': [0, 0, -1], '+x': [1, 0, 0], '−x': [-1, 0, 0], '+y': [0, 1, 0], '−y': [0, -1, 0], oblique: [0.6, -0.8, 0.7] };
/** What points up in the picture. */
export const upOf = (side) => (side.endsWith('z') ? [0, 1, 0] : [0, 0, 1]);
