package stellate_test

import (
	"context"
	"math"
	"testing"

	"stellate"
)

// hemisphere is the part of the unit sphere where z is not negative.
type hemisphere struct{}

func (hemisphere) Dimension() int        { return 2 }
func (hemisphere) AmbientDimension() int { return 3 }
func (hemisphere) Walls() int            { return 1 }

func (hemisphere) BoundingBox() (lower, upper []float64) {
	return []float64{-1.1, -1.1, -1.1}, []float64{1.1, 1.1, 1.1}
}

func (hemisphere) ClosestPoint(x, points []float64, found []bool) error {
	for i := 0; i < len(x); i += 3 {
		length := math.Sqrt(x[i]*x[i] + x[i+1]*x[i+1] + x[i+2]*x[i+2])
		points[i], points[i+1], points[i+2] = x[i]/length, x[i+1]/length, x[i+2]/length
	}
	return nil
}

func (hemisphere) FacePoint(x []float64, _ []uint32, points []float64, found []bool) error {
	for i := 0; i < len(x); i += 3 {
		length := math.Sqrt(x[i]*x[i] + x[i+1]*x[i+1])
		points[i], points[i+1], points[i+2] = x[i]/length, x[i+1]/length, 0
	}
	return nil
}

func (hemisphere) TangentBasis(p, bases []float64) error {
	for i := 0; i < len(p); i += 3 {
		x, y, s := p[i], p[i+1], math.Copysign(1, p[i+2])
		a := -1 / (s + p[i+2])
		copy(bases[2*i:], []float64{1 + s*x*x*a, x * y * a, s * x * y * a, s + y*y*a, -s * x, -y})
	}
	return nil
}

func (hemisphere) Clearances(points, values []float64) error {
	for i := range values {
		values[i] = points[3*i+2]
	}
	return nil
}

func (hemisphere) Conormals(_ []float64, _ []uint32, normals []float64) error {
	for i := 2; i < len(normals); i += 3 {
		normals[i] = -1
	}
	return nil
}

func TestManifoldsWithBoundary(t *testing.T) {
	to := server(t)
	mesh, err := stellate.NewMesh(context.Background(), hemisphere{}, 0.2, &stellate.Options{Connection: to})
	if err != nil || !mesh.Certified() {
		t.Fatal(err, mesh.Report.GetText())
	}
	if got := counts(mesh); got != hemisphereCounts(t) {
		t.Error(got)
	}
	edges := mesh.Boundary()
	on := 0
	for vertex, walls := range mesh.Walls {
		if walls != 0 {
			on++
		}
		if z := mesh.Points[3*vertex+2]; (z == 0) != (walls == 1) || z < 0 {
			t.Error(vertex, z, walls)
		}
	}
	if len(mesh.Walls) != mesh.VertexCount() || on == 0 || len(edges) != 2*on { // a circle
		t.Error(len(mesh.Walls), on, len(edges))
	}
	for _, vertex := range edges {
		if mesh.Walls[vertex] != 1 {
			t.Error("the boundary leaves the wall at", vertex)
		}
	}
	c := client(t, to)
	info, err := c.Create(context.Background(), hemisphere{}, 0.2, nil)
	if err != nil {
		t.Fatal(err)
	}
	if _, err := c.Serve(context.Background(), torus, info.GetName(), stellate.WorkerOptions{}); err == nil {
		t.Error("an oracle without the walls is not refused")
	}
	if _, err := c.Serve(context.Background(), hemisphere{}, info.GetName(), stellate.WorkerOptions{}); err != nil {
		t.Fatal(err)
	}
	fetched, err := c.Download(context.Background(), info.GetName(), 0)
	if err != nil || counts(fetched) != counts(mesh) || len(fetched.Walls) != len(mesh.Walls) {
		t.Error(fetched, err)
	}
}
