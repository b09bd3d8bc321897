// What the packages `fold` and `rabbit-ear` make of a FOLD file, or `fold` of an OPX file: JSON on
// standard output; with the word layers, how rabbit-ear orders the layers of a FOLD file.
// usage: node read_with_others.cjs FILE [layers]
const { readFileSync } = require("node:fs");
const FOLD = require("fold");
const ear = require("rabbit-ear");

const text = readFileSync(process.argv[2], "utf8");
const read = () => JSON.parse(text);

function withFold() {
  const graph = { ...read(), faces_edges: [] };  // its converter fills this but does not make it
  const { filter, convert } = FOLD;
  convert.edges_vertices_to_edges_faces_edges(graph);
  const uncounted = graph.edges_faces.filter((faces) => faces.every((face) => face === null)).length;
  const closure = convert.flatFoldedGeometry(graph, 0);
  return {
    vertices: filter.numVertices(graph),
    edges: filter.numEdges(graph),
    faces: filter.numFaces(graph),
    mountains: filter.mountainEdges(graph).length,
    valleys: filter.valleyEdges(graph).length,
    border: filter.boundaryEdges(graph).length,
    edges_without_faces: uncounted,
    flat_folded: graph.vertices_flatFoldCoords,
    flat_folded_closure: closure,
    walked_faces: walked(convert),
  };
}

/** The facets as `fold` finds them from the vertices and edges alone. */
function walked(convert) {
  const { vertices_coords, edges_vertices } = read();
  const graph = { vertices_coords, edges_vertices };
  convert.edges_vertices_to_faces_vertices(graph);
  return graph.faces_vertices;
}

function withRabbitEar() {
  const graph = read();
  return {
    validation: ear.graph.validate(graph),
    folded: ear.graph.makeVerticesCoordsFolded(graph),
  };
}

/** The layer orders of the pattern folded flat: 1 where the first of "f g" is above, -1 below. */
function layers() {
  const { vertices_coords, edges_vertices, edges_assignment, faces_vertices } = read();
  const graph = ear.graph.populate({ vertices_coords, edges_vertices, edges_assignment, faces_vertices });
  graph.vertices_coords = ear.graph.makeVerticesCoordsFlatFolded(graph);
  console.log = () => {};  // the solver prints its times
  const { root, branches } = ear.layer.solver(graph, 1e-6);
  return { root, branches: branches ?? [] };
}

const answer = process.argv[2].endsWith(".opx")
  ? FOLD.convert.convertFromTo(text, "opx", "fold")
  : process.argv[3] === "layers" ? layers() : { fold: withFold(), rabbit_ear: withRabbitEar() };
process.stdout.write(JSON.stringify(answer));
