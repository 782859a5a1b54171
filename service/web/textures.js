/** Textures that are drawn here: the ring around a point, and the disc of a dot. */

import * as THREE from './vendor/three/three.module.js';

function texture(paint) {
  const canvas = document.createElement('canvas');
  canvas.width = 64;
  canvas.height = 64;
  paint(canvas.getContext('2d'));
  return new THREE.CanvasTexture(canvas);
}

export const ringTexture = () => texture((pen) => {
  for (const [width, colour] of [[12, '#fff'], [6, '#d0107a']]) {
    pen.lineWidth = width;
    pen.strokeStyle = colour;
    pen.beginPath();
    pen.arc(32, 32, 22, 0, 2 * Math.PI);
    pen.stroke();
  }
});

export const discTexture = () => texture((pen) => {
  pen.fillStyle = '#fff';
  pen.beginPath();
  pen.arc(32, 32, 28, 0, 2 * Math.PI);
  pen.fill();
});
