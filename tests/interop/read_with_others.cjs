// What the packages `fold` and `rabbit-ear` make of a FOLD file, or `fold` of an OPX file: JSON on
// standard output. usage: node read_with_others.cjs FILE
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

const answer = process.argv[2].endsWith(".opx")
  ? FOLD.convert.convertFromTo(text, "opx", "fold")
  : { fold: withFold(), rabbit_ear: withRabbitEar() };
process.stdout.write(JSON.stringify(answer));
