package stellate

import (
	"crypto/sha256"
	"encoding/binary"
	"iter"
	"math"

	pb "stellate/proto/v1"
)

const chunkBytes = 1 << 20 // of the points in a message, where the server takes as much

// PointCloud is points on a k-manifold in R^d or near it, one after the other.
type PointCloud struct {
	Dimension        int       // k of the manifold, 1 to 3
	AmbientDimension int       // d, more than k
	Points           []float64 // [n, d], finite
	// Tangents has of each point orthonormal tangent vectors, the columns of its [d, k]; nil: they are
	// estimated from the points.
	Tangents []float64 // [n, d, k]
}

// check says why no server can be asked for the cloud's mesh. Ranges are the server's to check.
func (c *PointCloud) check() error {
	for _, one := range []struct {
		name  string
		value int
	}{{"Dimension", c.Dimension}, {"AmbientDimension", c.AmbientDimension}} {
		if one.value < 1 || one.value > math.MaxInt32 {
			return invalid("%s has to be from 1 on, and is %d", one.name, one.value)
		}
	}
	if len(c.Points)%c.AmbientDimension != 0 {
		return invalid("%d numbers are no whole points of R^%d", len(c.Points), c.AmbientDimension)
	}
	if c.Tangents != nil && len(c.Tangents) != c.Dimension*len(c.Points) {
		return invalid("Tangents have %d numbers, and need %d: [n, d, k]", len(c.Tangents), c.Dimension*len(c.Points))
	}
	for i, value := range c.Points {
		if math.IsNaN(value) || math.IsInf(value, 0) {
			return invalid("point %d is not finite", i/c.AmbientDimension)
		}
	}
	return nil
}

func (c *PointCloud) count() int { return len(c.Points) / c.AmbientDimension }

// chunks are the messages of an upload, from a point on. mostBytes: that the server takes in one.
func (c *PointCloud) chunks(first int, mostBytes uint64) iter.Seq[*pb.PointsChunk] {
	k, d, n := c.Dimension, c.AmbientDimension, c.count()
	numbers := d
	if c.Tangents != nil {
		numbers += d * k
	}
	rows := max(1, int(min(chunkBytes, mostBytes/2))/(8*numbers))
	return func(yield func(*pb.PointsChunk) bool) {
		for row := first; row < n; row += rows {
			end := min(row+rows, n)
			block := &pb.Points{FirstRow: uint64(row), Points: toWire(c.Points[row*d:end*d], end-row, d)}
			if c.Tangents != nil {
				block.Tangents = toWire(c.Tangents[row*d*k:end*d*k], end-row, d, k)
			}
			if !yield(&pb.PointsChunk{Message: &pb.PointsChunk_Points{Points: block}}) {
				return
			}
		}
		last := &pb.PointsEnd{PointsSha256: digest(c.Points)}
		if c.Tangents != nil {
			last.TangentsSha256 = digest(c.Tangents)
		}
		yield(&pb.PointsChunk{Message: &pb.PointsChunk_End{End: last}})
	}
}

// digest is of the numbers as they travel.
func digest(values []float64) []byte {
	all := sha256.New()
	var block [8 * 512]byte
	for len(values) > 0 {
		count := min(len(values), 512)
		for i, value := range values[:count] {
			binary.LittleEndian.PutUint64(block[8*i:], math.Float64bits(value))
		}
		_, _ = all.Write(block[:8*count])
		values = values[count:]
	}
	return all.Sum(nil)
}
