// Balls and rods of long chains: two triangles each, that face the eye and are shaded as if they were round.

/// three.js calls this with the names of r111: instanceMatrix, modelViewMatrix, projectionMatrix.
function roundMaterial(vertex, fragment) {
  return new THREE.ShaderMaterial({
    uniforms: { color: { value: new THREE.Color() }, shaded: { value: 1 } },
    vertexShader: `varying vec2 at;\n${vertex}`,
    fragmentShader: `uniform vec3 color; uniform float shaded; varying vec2 at;\n${fragment}`,
    side: THREE.DoubleSide,
  });
}

/// Lit from above, a little from the right, in the directions of the screen.
const lit = "mix(1.0, 0.45 + 0.62 * max(0.0, dot(normal, vec3(0.26, 0.86, 0.44))), shaded)";

function ballMaterial() {
  return roundMaterial(
    `void main() {
      at = position.xy;
      vec4 middle = modelViewMatrix * instanceMatrix * vec4(0.0, 0.0, 0.0, 1.0);
      middle.xy += position.xy * length(instanceMatrix[0].xyz);
      gl_Position = projectionMatrix * middle;
    }`,
    `void main() {
      float square = dot(at, at);
      if (square > 1.0) discard;
      vec3 normal = vec3(at, sqrt(1.0 - square));
      gl_FragColor = vec4(color * ${lit}, 1.0);
    }`,
  );
}

function rodMaterial() {
  return roundMaterial(
    `void main() {
      at = position.xy;
      vec4 middle = modelViewMatrix * instanceMatrix * vec4(0.0, 0.0, 0.5 * position.y, 1.0);
      vec3 along = (modelViewMatrix * vec4(instanceMatrix[2].xyz, 0.0)).xyz;
      vec3 across = cross(along, middle.xyz);
      middle.xyz += position.x * length(instanceMatrix[0].xyz) * across / max(length(across), 1e-12);
      gl_Position = projectionMatrix * middle;
    }`,
    `void main() {
      vec3 normal = vec3(at.x * 0.3, sqrt(max(1.0 - at.x * at.x, 0.0)), 0.4); // at an edge at may lie beyond it
      gl_FragColor = vec4(color * ${lit}, 1.0);
    }`,
  );
}

/// The square from −1 to 1 that both stand on.
function square() {
  return new THREE.PlaneBufferGeometry(2, 2);
}
