package stellate

import (
	"errors"
	"fmt"
	"slices"
	"strings"

	pb "stellate/proto/v1"
)

const unsettled = 300_000 // vertex numbers of removed simplices at least; else half of those there

// growingComplex is the client's copy of a mesh that grows by deltas: vertices and simplices as of the
// last complete revision. What comes and goes is put aside, and settled for many revisions together.
type growingComplex struct {
	k, d           int
	revision       uint64
	coordinates    []float64
	walls          []uint64 // bits, of the vertices up to the last on a wall
	rows           []uint32 // in lexicographic order
	added, removed []uint32
	pending        []*pb.MeshDelta
	turned         []byte   // as Mesh.Turned, of the last revision; nil: not known
	turnedRows     []uint32 // of a download
	untold         bool     // a part of the download was not oriented
	places         []string // of a download of a reconstruction
	smoothed       []float64
}

// growthOf is the empty mesh of a specification. The boundary alone has simplices of one dimension less.
func growthOf(spec *pb.MeshSpec) *growingComplex {
	k := int(spec.GetDimension())
	if spec.GetBoundaryOnly() {
		k--
	}
	return &growingComplex{k: k, d: int(spec.GetAmbientDimension())}
}

// absorb takes one chunk; true when a revision is complete with it. An error is a delta that does not
// fit what came before.
func (g *growingComplex) absorb(chunk *pb.DeltaChunk) (bool, error) {
	delta := chunk.GetDelta()
	revision := delta.GetRevision()
	if revision <= g.revision || (len(g.pending) > 0 && g.pending[0].GetRevision() != revision) {
		return false, fmt.Errorf("revision %d is out of order", revision)
	}
	g.pending, g.turned = append(g.pending, delta), nil
	if !chunk.GetComplete() {
		return false, nil
	}
	whole := g.pending
	g.pending = nil
	for _, part := range whole {
		points, err := numbers(part.GetPoints(), -1, g.d)
		if err == nil {
			err = g.addPoints(part.GetFirstVertex(), points)
		}
		if err != nil {
			return false, err
		}
	}
	for _, part := range whole {
		if err := g.change(part); err != nil {
			return false, err
		}
	}
	g.revision = revision
	if len(g.removed) > max(unsettled, len(g.rows)/2) {
		return true, g.settle()
	}
	return true, nil
}

func (g *growingComplex) addPoints(first uint64, block []float64) error {
	if count := uint64(len(g.coordinates) / g.d); len(block) > 0 && first != count {
		return fmt.Errorf("a delta starts at vertex %d, and there are %d", first, count)
	}
	g.coordinates = append(g.coordinates, block...)
	return nil
}

func (g *growingComplex) change(delta *pb.MeshDelta) error {
	added, err := indices(delta.GetAdded(), -1, g.k+1)
	if err != nil {
		return err
	}
	removed, err := indices(delta.GetRemoved(), -1, g.k+1)
	if err != nil {
		return err
	}
	if err := g.addWalls(delta.GetBoundaryVertices(), delta.GetBoundaryWalls()); err != nil {
		return err
	}
	count := len(g.coordinates) / g.d
	for _, id := range added {
		if int(id) >= count {
			return fmt.Errorf("a simplex has vertex %d of %d vertices", id, count)
		}
	}
	g.added, g.removed = append(g.added, added...), append(g.removed, removed...)
	return nil
}

// addWalls notes which vertices lie on which walls.
func (g *growingComplex) addWalls(vertices []uint32, walls []uint64) error {
	count := len(g.coordinates) / g.d
	if len(vertices) != len(walls) || (len(vertices) > 0 && int(vertices[len(vertices)-1]) >= count) {
		return fmt.Errorf("walls of %d vertices do not fit the %d that there are", len(vertices), count)
	}
	for i, vertex := range vertices {
		if missing := int(vertex) + 1 - len(g.walls); missing > 0 {
			g.walls = append(g.walls, make([]uint64, missing)...)
		}
		g.walls[vertex] = walls[i]
	}
	return nil
}

// orient takes a chunk of the orientation, which comes after the last revision.
func (g *growingComplex) orient(chunk *pb.Orientation) error {
	if !chunk.GetOrientable() {
		g.turned = nil
		return nil
	}
	if chunk.GetFirstSimplex() == 0 {
		g.turned = []byte{}
	}
	if g.turned == nil || chunk.GetFirstSimplex() != 8*uint64(len(g.turned)) {
		return fmt.Errorf("the orientation of simplex %d is out of order", chunk.GetFirstSimplex())
	}
	g.turned = append(g.turned, chunk.GetTurned()...)
	return nil
}

// orientPart notes which simplices of a part of a download, that change has just taken, are turned.
func (g *growingComplex) orientPart(part *pb.DownloadMeshResponse) error {
	width, turned := g.k+1, part.GetOrientation().GetTurned()
	cells := g.added[len(g.added)-len(part.GetCells().GetData())/4:]
	if !part.GetOrientation().GetOrientable() {
		g.untold = g.untold || len(cells) > 0
		return nil
	}
	if len(turned) != bytesOfBits(len(cells)/width) {
		return fmt.Errorf("an orientation of %d bytes came with %d simplices", len(turned), len(cells)/width)
	}
	for s := range len(cells) / width {
		if isSet(turned, s) {
			g.turnedRows = append(g.turnedRows, cells[s*width:(s+1)*width]...)
		}
	}
	return nil
}

// addPlaces notes what became of the points of a part of a download, that addPoints has just taken.
func (g *growingComplex) addPlaces(part *pb.Places) error {
	for _, code := range part.GetCodes() {
		g.places = append(g.places, strings.TrimPrefix(pb.Place(code).String(), "PLACE_"))
	}
	if part.GetSmoothed() == nil {
		return nil
	}
	positions, err := numbers(part.GetSmoothed(), len(part.GetCodes()), g.d)
	g.smoothed = append(g.smoothed, positions...)
	return err
}

// downloaded is the mesh of a download that is complete.
func (g *growingComplex) downloaded() (*Mesh, error) {
	if err := g.settle(); err != nil {
		return nil, protocolError(err)
	}
	if !g.untold {
		g.turned = bitsOf(g.rows, g.turnedRows, g.k+1)
	}
	mesh, err := g.finished()
	if err == nil && len(g.places) == mesh.VertexCount() {
		mesh.Places = g.places
	}
	if err == nil && len(g.smoothed) == len(mesh.Points) {
		mesh.Smoothed = g.smoothed
	}
	return mesh, err
}

// finished is the mesh at its end, with its orientation.
func (g *growingComplex) finished() (*Mesh, error) {
	mesh, err := g.mesh()
	if err == nil && g.turned != nil && len(g.turned) != bytesOfBits(mesh.SimplexCount()) {
		err = protocolError(fmt.Errorf("an orientation of %d bytes came for %d simplices", len(g.turned), mesh.SimplexCount()))
	}
	if err != nil {
		return nil, err
	}
	mesh.Turned = g.turned
	return mesh, nil
}

// settle makes the rows current.
func (g *growingComplex) settle() error {
	if len(g.added)+len(g.removed) == 0 {
		return nil
	}
	width := g.k + 1
	all := slices.Concat(g.rows, g.added, g.removed)
	firstRemoved := int32((len(g.rows) + len(g.added)) / width)
	order := sortedOrder(all, width)
	var left []int32
	for i := 0; i < len(order); {
		first, there := order[i], 0
		row := rowAt(all, width, first)
		for ; i < len(order) && slices.Equal(rowAt(all, width, order[i]), row); i++ {
			if order[i] < firstRemoved {
				there++
			} else {
				there--
			}
		}
		switch {
		case there < 0:
			return errors.New("a delta removes simplices that are not there")
		case there > 1:
			return errors.New("a delta adds simplices that are there already")
		case there == 1:
			left = append(left, first)
		}
	}
	g.rows = takeRows(all, width, left)
	g.added, g.removed = nil, nil
	return nil
}

// mesh is the mesh as of the last complete revision. It stays what it is while the complex grows.
func (g *growingComplex) mesh() (*Mesh, error) {
	if err := g.settle(); err != nil {
		return nil, protocolError(err)
	}
	points := g.coordinates[:len(g.coordinates):len(g.coordinates)]
	var walls []uint64
	if len(g.walls) > 0 {
		walls = append(slices.Clone(g.walls), make([]uint64, len(points)/g.d-len(g.walls))...)
	}
	return &Mesh{Dimension: g.k, AmbientDimension: g.d, Points: points, Simplices: g.rows, Walls: walls,
		Revision: g.revision}, nil
}

// reset goes back to the empty mesh.
func (g *growingComplex) reset() { *g = growingComplex{k: g.k, d: g.d} }
