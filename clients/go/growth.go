package stellate

import (
	"errors"
	"fmt"
	"slices"

	pb "stellate/proto/v1"
)

const unsettled = 300_000 // vertex numbers of removed simplices at least; else half of those there

// growingComplex is the client's copy of a mesh that grows by deltas: vertices and simplices as of the
// last complete revision. What comes and goes is put aside, and settled for many revisions at once.
type growingComplex struct {
	k, d           int
	revision       uint64
	coordinates    []float64
	walls          []uint64 // bits, of the vertices up to the last on a wall
	rows           []uint32 // in lexicographic order
	added, removed []uint32
	pending        []*pb.MeshDelta
}

// absorb takes one chunk; true when a revision is complete with it. An error is a delta that does not
// fit what came before.
func (g *growingComplex) absorb(chunk *pb.DeltaChunk) (bool, error) {
	delta := chunk.GetDelta()
	revision := delta.GetRevision()
	if revision <= g.revision || (len(g.pending) > 0 && g.pending[0].GetRevision() != revision) {
		return false, fmt.Errorf("revision %d is out of order", revision)
	}
	g.pending = append(g.pending, delta)
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
