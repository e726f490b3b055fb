package stellate_test

import (
	"context"
	"errors"
	"math"
	"slices"
	"strings"
	"sync"
	"testing"

	"stellate"
	pb "stellate/proto/v1"
)

// spherePoints are n points of the unit sphere down to a height, evenly; -1: all of it.
func spherePoints(n int, lowest float64) stellate.PointCloud {
	points := make([]float64, 0, 3*n)
	for i := range n {
		z := 1 - (1-lowest)*(float64(i)+0.5)/float64(n)
		turn := float64(i) * math.Pi * (3 - math.Sqrt(5))
		around := math.Sqrt(1 - z*z)
		points = append(points, around*math.Cos(turn), around*math.Sin(turn), z)
	}
	return stellate.PointCloud{Dimension: 2, AmbientDimension: 3, Points: points}
}

func reconstructed(t *testing.T, cloud stellate.PointCloud, options *stellate.ReconstructOptions) *stellate.Mesh {
	t.Helper()
	mesh, err := stellate.Reconstruct(context.Background(), cloud, options)
	if err != nil {
		t.Fatal(err)
	}
	return mesh
}

var exact = new(float64)

func TestReconstructedSphere(t *testing.T) {
	to, cloud := server(t), spherePoints(600, -1)
	heard := 0
	mesh := reconstructed(t, cloud, &stellate.ReconstructOptions{Connection: to, Noise: exact,
		RequireCertified: true, OnProgress: func(*pb.Progress) { heard++ }})
	if !slices.Equal(mesh.Points, cloud.Points) || mesh.SimplexCount() != 2*600-4 || heard == 0 {
		t.Error(counts(mesh), heard)
	}
	if mesh.OrientedSimplices() == nil || mesh.Smoothed != nil || len(mesh.Places) != 600 {
		t.Error("no orientation, or places, or smoothed points that were exact")
	}
	if slices.ContainsFunc(mesh.Places, func(place string) bool { return place != "OK" }) {
		t.Error(mesh.Places)
	}
	again := reconstructed(t, cloud, &stellate.ReconstructOptions{Noise: exact}) // a server of its own
	if !slices.Equal(again.Simplices, mesh.Simplices) {
		t.Error("another mesh from another server")
	}
	for left := range client(t, to).List(context.Background()) {
		t.Error(left.GetName(), "is left behind")
	}
}

func TestReconstructedByWeightsOnly(t *testing.T) {
	mesh := reconstructed(t, spherePoints(600, -1), &stellate.ReconstructOptions{Connection: server(t),
		Noise: exact, RequireCertified: true, WeightsOnly: true, Steiner: true,
		Spec: func(spec *pb.Reconstruction) {
			if spec.GetWeights() != pb.Weighting_WEIGHTING_ONLY || !spec.GetSteiner() {
				t.Error(spec)
			}
		}})
	if mesh.SimplexCount() != 2*600-4 {
		t.Error(counts(mesh))
	}
}

func TestReconstructedWithTangentsIsProved(t *testing.T) {
	cloud := spherePoints(2500, -1)
	for i := 0; i < len(cloud.Points); i += 3 {
		x, y, z := cloud.Points[i], cloud.Points[i+1], cloud.Points[i+2]
		around := math.Hypot(x, y)
		cloud.Tangents = append(cloud.Tangents,
			-y/around, -z*x/around, x/around, -z*y/around, 0, around)
	}
	mesh := reconstructed(t, cloud, &stellate.ReconstructOptions{Connection: server(t), Noise: exact, Reach: 1})
	if level := mesh.Report.GetCertificate().GetLevel(); level != pb.CertificateLevel_CERTIFICATE_LEVEL_PROVED {
		t.Error(level, mesh.Report.GetCertificate().GetVerdict())
	}
}

func TestReconstructedWhereTheSampleEnds(t *testing.T) {
	to, cap := server(t), spherePoints(600, -0.2)
	mesh := reconstructed(t, cap, &stellate.ReconstructOptions{Connection: to, Noise: exact})
	if mesh.Certified() || !slices.Contains(mesh.Places, "EDGE") {
		t.Error(mesh.Report.GetCertificate().GetVerdict())
	}
	open := reconstructed(t, cap, &stellate.ReconstructOptions{Connection: to, Noise: exact, Open: true})
	if len(open.Boundary()) == 0 || open.Report.GetCertificate().GetEulerCharacteristic() != 1 {
		t.Error(open.Report.GetCertificate().GetVerdict())
	}
	_, err := stellate.Reconstruct(context.Background(), cap,
		&stellate.ReconstructOptions{Connection: to, Noise: exact, RequireCertified: true})
	var ours *stellate.Error
	if !errors.As(err, &ours) || !errors.Is(err, stellate.ErrNotCertified) || ours.Mesh.VertexCount() != 600 {
		t.Error(err)
	}
	shaken := spherePoints(900, -1)
	for i := range shaken.Points {
		shaken.Points[i] += 0.01 * math.Sin(12.9898*float64(i))
	}
	noisy := reconstructed(t, shaken, &stellate.ReconstructOptions{Connection: to})
	if len(noisy.Smoothed) != len(shaken.Points) || !slices.Equal(noisy.Points, shaken.Points) {
		t.Error("noise has not moved the complex, or has moved the points")
	}
}

func TestPointsThatCannotBeTaken(t *testing.T) {
	to := server(t)
	for words, spoil := range map[string]func(*stellate.PointCloud){
		"no whole points of R^3":  func(c *stellate.PointCloud) { c.Points = c.Points[1:] },
		"point 2 is not finite":   func(c *stellate.PointCloud) { c.Points[7] = math.NaN() },
		"need 300":                func(c *stellate.PointCloud) { c.Tangents = make([]float64, 3) },
		"Dimension has to be":     func(c *stellate.PointCloud) { c.Dimension = 0 },
		"k must be less than d":   func(c *stellate.PointCloud) { c.Dimension = 3 },
		"needs 4 at least":        func(c *stellate.PointCloud) { c.Points = c.Points[:9] },
		"AmbientDimension has to": func(c *stellate.PointCloud) { c.AmbientDimension = -3 },
	} {
		cloud := spherePoints(50, -1)
		spoil(&cloud)
		_, err := stellate.Reconstruct(context.Background(), cloud, &stellate.ReconstructOptions{Connection: to})
		if !errors.Is(err, stellate.ErrInvalidArgument) || !strings.Contains(err.Error(), words) {
			t.Errorf("%q: %v", words, err)
		}
	}
	ctx, cancel := context.WithCancel(context.Background())
	defer cancel()
	_, err := stellate.Reconstruct(ctx, spherePoints(20_000, -1),
		&stellate.ReconstructOptions{Connection: to, OnProgress: func(*pb.Progress) { cancel() }})
	if !errors.Is(err, stellate.ErrCancelled) || !errors.Is(err, context.Canceled) {
		t.Error(err)
	}
}

func TestUploadGoesOnAfterAKill(t *testing.T) {
	address, restart, _ := restartingServer(t)
	cloud := spherePoints(40_000, -1)
	var once sync.Once
	mesh := reconstructed(t, cloud, &stellate.ReconstructOptions{Noise: exact,
		Connection: stellate.Connection{Server: address, OnOutage: func(string) {}},
		OnProgress: func(*pb.Progress) { once.Do(restart) }})
	if !slices.Equal(mesh.Points, cloud.Points) || mesh.SimplexCount() != 2*40_000-4 {
		t.Error(counts(mesh))
	}
}
