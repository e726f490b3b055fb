package stellate

import (
	"fmt"
	"math"
	"sync"

	pb "stellate/proto/v1"
)

// Oracle is a compact smooth k-submanifold M of R^d without boundary, 1 <= k < d, unless it is Walled.
//
// Methods take and fill whole batches, of len(found) points. The answer to a query must not depend on
// the rest of its batch. Calls come one at a time, unless the oracle is ConcurrencySafe. An oracle may
// have more methods: see FlatIntersector, TangentBaser, LocalSizer, Bounded and Seeded; one of the last
// two is needed.
type Oracle interface {
	Dimension() int        // k
	AmbientDimension() int // d
	// ClosestPoint writes a point of M nearest to each x [n, d] to points, and sets found to false
	// where it has none; found comes as true everywhere.
	ClosestPoint(x, points []float64, found []bool) error
}

// FlatIntersector finds the point of M nearest to each center [n, d] in the flat through it that is
// orthogonal to the columns of its basis [n, d, k], within the radius [n].
type FlatIntersector interface {
	IntersectFlat(centers, bases, radii, points []float64, found []bool) error
}

// TangentBaser knows tangent spaces: at points [n, d] of M it writes orthonormal columns [n, d, k].
type TangentBaser interface {
	TangentBasis(points, bases []float64) error
}

// LocalSizer says how large things are at points [n, d] of M: the local feature size, or any positive
// lengths [n].
type LocalSizer interface {
	LocalSize(points, sizes []float64) error
}

// Walled manifolds have a boundary: M is where all walls are at least 0 on M^, a manifold without one,
// which the other methods describe; it may be R^d itself. It takes a TangentBaser, too. The walls of a
// face ascend.
type Walled interface {
	Walls() int
	// FacePoint finds a nearest point of M^ where the walls of the face are 0, whatever the others are.
	FacePoint(x []float64, face []uint32, points []float64, found []bool) error
	// Clearances writes the walls' values at points [n, d], whose signs count, [n, Walls()].
	Clearances(points, values []float64) error
	// Conormals writes, at points of a face, of each of its walls the unit normal within the tangent space
	// along which the wall's value falls: [n, len(face), d].
	Conormals(points []float64, face []uint32, normals []float64) error
}

// Bounded says where to look for M.
type Bounded interface {
	BoundingBox() (lower, upper []float64)
}

// Seeded has points [m, d] near M, one at least on each component.
type Seeded interface {
	Seeds() []float64
}

// ConcurrencySafe oracles may be called by several workers at the same time.
type ConcurrencySafe interface {
	ConcurrencySafe() bool
}

// checkedOracle is an oracle as the server sees it.
type checkedOracle struct {
	oracle       Oracle
	k, d, walls  int
	capabilities *pb.OracleCapabilities
	mutex        sync.Locker
}

type free struct{}

func (free) Lock()   {}
func (free) Unlock() {}

func check(oracle Oracle) (*checkedOracle, error) {
	if oracle == nil {
		return nil, invalid("there is no oracle")
	}
	c := &checkedOracle{oracle: oracle, k: oracle.Dimension(), d: oracle.AmbientDimension(), mutex: &sync.Mutex{}}
	walled, hasWalls := oracle.(Walled)
	if hasWalls {
		c.walls = walled.Walls()
	}
	if c.k < 1 || c.d < c.k || (c.d == c.k && c.walls == 0) {
		return nil, invalid("dimension %d in R^%d: 1 <= k < d is needed, or k = d with walls", c.k, c.d)
	}
	_, flats := oracle.(FlatIntersector)
	_, tangents := oracle.(TangentBaser)
	_, sizes := oracle.(LocalSizer)
	c.capabilities = &pb.OracleCapabilities{IntersectFlat: flats, TangentBasis: tangents, LocalSize: sizes,
		Conormals: c.walls > 0}
	if c.walls > 0 && !tangents {
		return nil, invalid("an oracle with walls needs a method TangentBasis")
	}
	if safe, says := oracle.(ConcurrencySafe); says && safe.ConcurrencySafe() {
		c.mutex = free{}
	}
	return c, nil
}

// answer asks the oracle one chunk. Errors are the oracle's, or say what is wrong with its numbers.
func (c *checkedOracle) answer(chunk *pb.QueryChunk) (*pb.AnswerChunk, error) {
	c.mutex.Lock()
	defer c.mutex.Unlock()
	x, err := numbers(chunk.GetPoints(), -1, c.d)
	if err != nil {
		return nil, protocolError(err)
	}
	n := len(x) / c.d
	points, found := make([]float64, len(x)), make([]bool, n)
	for i := range found {
		found[i] = true
	}
	if err := c.ask(chunk, x, points, found); err != nil {
		return nil, err
	}
	rows := make([]int, 0, n)
	for i, there := range found {
		if there {
			rows = append(rows, i)
		}
	}
	if err := finite("the answer", points, c.d, rows); err != nil {
		return nil, err
	}
	reply := &pb.AnswerChunk{Lease: chunk.GetLease(), Points: toWire(points, n, c.d)}
	if len(rows) < n {
		reply.Found = make([]byte, n)
		for _, row := range rows {
			reply.Found[row] = 1
		}
	}
	if chunk.GetWantTangents() {
		anywhere := make([]float64, c.d*c.k)
		for a := range c.k {
			anywhere[a*c.k+a] = 1
		}
		bases, err := c.atFound("TangentBasis", c.oracle.(TangentBaser).TangentBasis, points, rows, anywhere)
		if err != nil {
			return nil, err
		}
		reply.Tangents = toWire(bases, n, c.d, c.k)
	}
	if chunk.GetWantSizes() {
		sizes, err := c.atFound("LocalSize", c.oracle.(LocalSizer).LocalSize, points, rows, []float64{1})
		if err != nil {
			return nil, err
		}
		reply.Sizes = toWire(sizes, n)
	}
	if chunk.GetWantClearances() {
		if err := c.addWalls(reply, chunk.GetFace(), points, rows); err != nil {
			return nil, err
		}
	}
	return reply, nil
}

// addWalls adds what the walls are at the points, and, on a face, its conormals.
func (c *checkedOracle) addWalls(reply *pb.AnswerChunk, face []uint32, points []float64, rows []int) error {
	walled, n := c.oracle.(Walled), len(points)/c.d
	values, err := c.atFound("Clearances", walled.Clearances, points, rows, make([]float64, c.walls))
	if err != nil {
		return err
	}
	reply.Clearances = toWire(values, n, c.walls)
	if len(face) == 0 {
		return nil
	}
	conormals := func(points, normals []float64) error { return walled.Conormals(points, face, normals) }
	normals, err := c.atFound("Conormals", conormals, points, rows, make([]float64, len(face)*c.d))
	if err == nil {
		reply.Conormals = toWire(normals, n, len(face), c.d)
	}
	return err
}

func (c *checkedOracle) ask(chunk *pb.QueryChunk, x, points []float64, found []bool) error {
	switch chunk.GetKind() {
	case pb.QueryKind_QUERY_KIND_CLOSEST_POINT:
		if face := chunk.GetFace(); len(face) > 0 {
			return c.oracle.(Walled).FacePoint(x, face, points, found)
		}
		return c.oracle.ClosestPoint(x, points, found)
	case pb.QueryKind_QUERY_KIND_INTERSECT_FLAT:
		bases, err := numbers(chunk.GetBases(), len(found), c.d, c.k)
		if err != nil {
			return protocolError(err)
		}
		radii, err := numbers(chunk.GetRadii(), len(found))
		if err != nil {
			return protocolError(err)
		}
		return c.oracle.(FlatIntersector).IntersectFlat(x, bases, radii, points, found)
	}
	return fmt.Errorf("the server asks a question of kind %v, unknown to this client", chunk.GetKind())
}

// atFound is what the method says of the points that were found, and `anywhere` for the others.
func (c *checkedOracle) atFound(
	name string, method func(points, values []float64) error, points []float64, rows []int, anywhere []float64,
) ([]float64, error) {
	n, width := len(points)/c.d, len(anywhere)
	asked := points
	if len(rows) < n {
		asked = make([]float64, 0, len(rows)*c.d)
		for _, row := range rows {
			asked = append(asked, points[row*c.d:(row+1)*c.d]...)
		}
	}
	values := make([]float64, len(rows)*width)
	if len(rows) > 0 {
		if err := method(asked, values); err != nil {
			return nil, err
		}
	}
	all := make([]int, len(rows))
	for i := range all {
		all[i] = i
	}
	if err := finite(name, values, width, all); err != nil || len(rows) == n {
		return values, err
	}
	spread := make([]float64, 0, n*width)
	for range n {
		spread = append(spread, anywhere...)
	}
	for i, row := range rows {
		copy(spread[row*width:], values[i*width:(i+1)*width])
	}
	return spread, nil
}

func finite(what string, values []float64, width int, rows []int) error {
	for _, row := range rows {
		for _, value := range values[row*width : (row+1)*width] {
			if math.IsNaN(value) || math.IsInf(value, 0) {
				return newError(ErrOracle, "ORACLE_NOT_FINITE", "%s for point %d of a batch is %v", what, row, value)
			}
		}
	}
	return nil
}
