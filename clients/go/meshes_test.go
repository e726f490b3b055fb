package stellate_test

import (
	"context"
	"errors"
	"fmt"
	"math"
	"os"
	"path/filepath"
	"slices"
	"strings"
	"testing"

	"stellate"
	pb "stellate/proto/v1"
)

func TestSameMeshesAsPython(t *testing.T) {
	torusCounts, cliffordCounts := expected(t)
	mesh, err := meshed(stellate.Connection{}, torus) // a server of its own
	if err != nil {
		t.Fatal(err)
	}
	if counts(mesh) != torusCounts || !mesh.Certified() {
		t.Errorf("torus: %v, certified %v; Python has %v", counts(mesh), mesh.Certified(), torusCounts)
	}
	options := &stellate.Options{Connection: server(t), RequireCertified: true}
	mesh, err = stellate.NewMesh(context.Background(), stellate.ProductOfCircles{K: 2}, 0.3, options)
	if err != nil {
		t.Fatal(err)
	}
	if counts(mesh) != cliffordCounts {
		t.Errorf("Clifford torus: %v; Python has %v", counts(mesh), cliffordCounts)
	}
	if chi := mesh.Report.GetCertificate().GetEulerCharacteristic(); chi != 0 {
		t.Errorf("Euler characteristic %d", chi)
	}
}

// sphere answers everything but tangents, and has seeds instead of a box.
type sphere struct{ asked, most *int }

func (sphere) Dimension() int        { return 2 }
func (sphere) AmbientDimension() int { return 3 }
func (sphere) Seeds() []float64      { return []float64{0, 0, 1} }

func (sphere) ClosestPoint(x, points []float64, found []bool) error {
	for i := range found {
		length := math.Sqrt(x[3*i]*x[3*i] + x[3*i+1]*x[3*i+1] + x[3*i+2]*x[3*i+2])
		for j := 3 * i; j < 3*i+3; j++ {
			points[j] = x[j] / length
		}
		found[i] = length > 1e-9
	}
	return nil
}

func (s sphere) IntersectFlat(centers, bases, radii, points []float64, found []bool) error {
	*s.asked += len(found)
	*s.most = max(*s.most, len(found))
	for i := range found {
		// The flat is the line along u = t0 x t1 through c: |c + s u| = 1.
		c, b := centers[3*i:3*i+3], bases[6*i:6*i+6]
		u := [3]float64{b[2]*b[5] - b[4]*b[3], b[4]*b[1] - b[0]*b[5], b[0]*b[3] - b[2]*b[1]}
		cu := c[0]*u[0] + c[1]*u[1] + c[2]*u[2]
		root := cu*cu - (c[0]*c[0] + c[1]*c[1] + c[2]*c[2]) + 1
		along := -cu + math.Copysign(math.Sqrt(math.Max(root, 0)), cu)
		if found[i] = root >= 0 && math.Abs(along) <= radii[i]; found[i] {
			for j := range 3 {
				points[3*i+j] = c[j] + along*u[j]
			}
		}
	}
	return nil
}

func (sphere) LocalSize(_, sizes []float64) error {
	for i := range sizes {
		sizes[i] = 1
	}
	return nil
}

func TestIntersectionsAndSizes(t *testing.T) {
	oracle := sphere{asked: new(int), most: new(int)}
	options := &stellate.Options{Connection: server(t), SizeRate: 0.25, Workers: 3, MaxChunk: 50}
	mesh, err := stellate.NewMesh(context.Background(), oracle, 0.3, options)
	if err != nil {
		t.Fatal(err)
	}
	proved := mesh.Report.GetCertificate()
	if !proved.GetCertified() || proved.GetEulerCharacteristic() != 2 || proved.GetMaxCircumradius() > 0.25 {
		t.Error(proved)
	}
	if *oracle.asked == 0 || *oracle.most > 50 {
		t.Errorf("%d intersections, %d at most at once", *oracle.asked, *oracle.most)
	}
}

func TestWatch(t *testing.T) {
	torusCounts, _ := expected(t)
	var sizes []int
	var last *stellate.Mesh
	phases := map[pb.Phase]bool{}
	options := &stellate.Options{Connection: server(t)}
	options.OnProgress = func(p *pb.Progress) { phases[p.GetPhase()] = true }
	for mesh, err := range stellate.Watch(context.Background(), torus, 0.1, options) {
		if err != nil {
			t.Fatal(err)
		}
		last, sizes = mesh, append(sizes, mesh.VertexCount())
	}
	if len(sizes) < 5 || !slices.IsSorted(sizes) || counts(last) != torusCounts {
		t.Errorf("sizes %v, counts %v", sizes, counts(last))
	}
	if !phases[pb.Phase_PHASE_REFINING] || !phases[pb.Phase_PHASE_DONE] {
		t.Error(phases)
	}
}

func TestCallByCall(t *testing.T) {
	ctx := context.Background()
	c := client(t, server(t))
	info, err := c.Create(ctx, torus, 0.1, &stellate.Options{Label: "by hand", RandomSeed: 7})
	if err != nil {
		t.Fatal(err)
	}
	states := make(chan string)
	go func() {
		state, err := c.Serve(ctx, torus, info.GetName(), stellate.WorkerOptions{Worker: "by hand"})
		states <- fmt.Sprint(state, err)
	}()
	var watched *stellate.Mesh
	for mesh, err := range c.Watch(ctx, info.GetName(), nil) {
		if err != nil {
			t.Fatal(err)
		}
		watched = mesh
	}
	late, err := c.Serve(ctx, torus, info.GetName(), stellate.WorkerOptions{}) // too late, and no error
	if state := <-states; state != "SUCCEEDED<nil>" || late != "SUCCEEDED" || err != nil {
		t.Error(state, late, err)
	}
	fetched, err := c.Download(ctx, info.GetName(), 0)
	if err != nil || !slices.Equal(fetched.Points, watched.Points) || !slices.Equal(fetched.Simplices, watched.Simplices) {
		t.Error("the download differs from what was watched", err)
	}
	listed := false
	for mesh, err := range c.List(ctx) {
		listed = listed || (err == nil && mesh.GetSpec().GetLabel() == "by hand")
	}
	if !listed {
		t.Error("not listed")
	}
	if err := c.Delete(ctx, info.GetName()); err != nil {
		t.Error(err)
	}
	if _, err := c.Get(ctx, info.GetName()); !errors.Is(err, stellate.ErrMeshNotFound) {
		t.Error(err)
	}
}

func TestCancelledByItsContext(t *testing.T) {
	ctx, cancel := context.WithCancel(context.Background())
	defer cancel()
	options := &stellate.Options{Connection: server(t)}
	options.OnProgress = func(p *pb.Progress) {
		if p.GetVertices() > 500 {
			cancel()
		}
	}
	_, err := stellate.NewMesh(ctx, torus, 0.01, options)
	var ours *stellate.Error
	if !errors.As(err, &ours) || !errors.Is(err, stellate.ErrCancelled) || !errors.Is(err, context.Canceled) {
		t.Fatal(err)
	}
	if ours.Mesh == nil || ours.Mesh.VertexCount() <= 500 {
		t.Error("the mesh so far is missing")
	}
}

func TestFiles(t *testing.T) {
	mesh, err := stellate.NewMesh(context.Background(), torus, 0.3, &stellate.Options{Connection: server(t)})
	if err != nil {
		t.Fatal(err)
	}
	folder := t.TempDir()
	for _, name := range []string{"torus.txt", "torus.obj"} {
		if err := mesh.Save(filepath.Join(folder, name)); err != nil {
			t.Fatal(err)
		}
	}
	text, _ := os.ReadFile(filepath.Join(folder, "torus.txt"))
	reader := strings.NewReader(string(text))
	var head [4]int
	fmt.Fscan(reader, &head[0], &head[1], &head[2], &head[3])
	if head != [4]int{2, 3, mesh.VertexCount(), mesh.SimplexCount()} {
		t.Error(head)
	}
	for _, want := range mesh.Points {
		var value float64
		if _, err := fmt.Fscan(reader, &value); err != nil || value != want {
			t.Fatalf("%v instead of %v", value, want)
		}
	}
	text, _ = os.ReadFile(filepath.Join(folder, "torus.obj"))
	directed := map[[2]int]bool{}
	for line := range strings.Lines(string(text)) {
		var c [3]int
		if n, _ := fmt.Sscanf(line, "f %d %d %d", &c[0], &c[1], &c[2]); n != 3 {
			continue
		}
		for i := range 3 {
			edge := [2]int{c[i], c[(i+1)%3]}
			if directed[edge] {
				t.Fatal("two triangles run along an edge the same way")
			}
			directed[edge] = true
		}
	}
	if len(directed) != 3*mesh.SimplexCount() {
		t.Errorf("%d directed edges", len(directed))
	}
	if err := mesh.Save(filepath.Join(folder, "torus.vtu")); !errors.Is(err, stellate.ErrSave) {
		t.Error(err)
	}
}
