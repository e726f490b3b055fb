package stellate_test

import (
	"bytes"
	"context"
	"errors"
	"os"
	"path/filepath"
	"slices"
	"strings"
	"testing"

	"stellate"
	pb "stellate/proto/v1"
)

// counting is the torus, and how often it was asked.
type counting struct {
	stellate.Torus
	asked *int
}

func (c counting) ClosestPoint(x, points []float64, found []bool) error {
	*c.asked += len(found)
	return c.Torus.ClosestPoint(x, points, found)
}

func (counting) ConcurrencySafe() bool { return false }

func TestCheckpointGoesOn(t *testing.T) {
	folder := filepath.Join(t.TempDir(), "torus")
	ctx, cancel := context.WithCancel(context.Background())
	defer cancel()
	options := stellate.Options{Checkpoint: folder, OnProgress: func(progress *pb.Progress) {
		if progress.GetVertices() > 500 {
			cancel()
		}
	}}
	first, second := 0, 0
	_, err := stellate.NewMesh(ctx, counting{torus, &first}, 0.05, &options)
	var ours *stellate.Error
	if !errors.Is(err, stellate.ErrCancelled) || !errors.As(err, &ours) || ours.Mesh.VertexCount() == 0 {
		t.Fatal(err)
	}
	options.OnProgress, options.Label = nil, "another label is no other mesh"
	mesh, err := stellate.NewMesh(context.Background(), counting{torus, &second}, 0.05, &options)
	if err != nil || !mesh.Certified() {
		t.Fatal(mesh, err)
	}
	straight, err := stellate.NewMesh(context.Background(), torus, 0.05, nil)
	if err != nil {
		t.Fatal(err)
	}
	if !slices.Equal(mesh.Points, straight.Points) || !slices.Equal(mesh.Simplices, straight.Simplices) {
		t.Error("the mesh that went on is another")
	}
	if total := int(straight.Report.GetCounts().GetQueries()); first == 0 || second >= total {
		t.Error("asked", first, "and", second, "of", total)
	}
	// The record of another language's client: it chose epsilon, says why, and writes out an empty label.
	record := filepath.Join(folder, "mesh")
	kept, err := os.ReadFile(record)
	theirs := append(bytes.Replace(kept, []byte("\n"), []byte(" 2 a quarter of the reach\n"), 1), "R\x00"...)
	if err := errors.Join(err, os.WriteFile(record, theirs, 0o600)); err != nil {
		t.Fatal(err)
	}
	third := 0
	again, err := stellate.NewMesh(context.Background(), counting{torus, &third}, 0.05, &options)
	if err != nil || third != 0 || counts(again) != counts(mesh) || !again.Certified() {
		t.Error("a finished mesh is there at once", third, err)
	}
	if _, err := stellate.NewMesh(context.Background(), torus, 0.06, &options); !errors.Is(err, stellate.ErrInvalidArgument) {
		t.Error(err)
	}
}

func TestCheckpointWaitsForABetterOracle(t *testing.T) {
	mine := errors.New("no such surface")
	options := stellate.Options{Checkpoint: t.TempDir()}
	failing := spoilt{torus, new(int), func([]float64) error { return mine }}
	if _, err := stellate.NewMesh(context.Background(), failing, 0.1, &options); !errors.Is(err, mine) {
		t.Fatal(err)
	}
	mesh, err := stellate.NewMesh(context.Background(), torus, 0.1, &options)
	if want, _ := expected(t); err != nil || counts(mesh) != want {
		t.Error(mesh, err)
	}
	// What the server refuses of an oracle is final, and the next call begins anew.
	options.Checkpoint = t.TempDir()
	moving := spoilt{torus, new(int), func(points []float64) error { points[0] *= 1.1; return nil }}
	if _, err := stellate.NewMesh(context.Background(), moving, 0.1, &options); !errors.Is(err, stellate.ErrOracle) {
		t.Fatal(err)
	}
	if _, err = stellate.NewMesh(context.Background(), torus, 0.1, &options); err != nil {
		t.Error(err)
	}
}

// Somebody else's: what is there is not believed, and no link leads to a file that is overwritten.
func TestCheckpointOfSomebodyElse(t *testing.T) {
	mine := t.TempDir()
	link, open := filepath.Join(mine, "link"), filepath.Join(mine, "open")
	if err := errors.Join(os.Symlink(t.TempDir(), link), os.Mkdir(open, 0o700), os.Chmod(open, 0o777)); err != nil {
		t.Fatal(err)
	}
	for folder, words := range map[string]string{link: "is a link", link + "/": "is a link", open: "chmod go-w"} {
		_, err := stellate.NewMesh(context.Background(), torus, 0.3, &stellate.Options{Checkpoint: folder})
		if !errors.Is(err, stellate.ErrInvalidArgument) || !strings.Contains(err.Error(), words) {
			t.Errorf("%s: %v", folder, err)
		}
	}

	folder, precious := filepath.Join(mine, "planted"), filepath.Join(mine, "precious")
	err := errors.Join(os.Mkdir(folder, 0o700), os.WriteFile(precious, []byte("mine"), 0o600),
		os.Symlink(precious, filepath.Join(folder, "mesh.new")))
	if err != nil {
		t.Fatal(err)
	}
	options := &stellate.Options{Checkpoint: folder}
	if _, err := stellate.NewMesh(context.Background(), torus, 0.3, options); err != nil {
		t.Fatal(err)
	}
	if kept, err := os.ReadFile(precious); err != nil || string(kept) != "mine" {
		t.Errorf("a draft overwrote %q, %v", kept, err)
	}
	record := filepath.Join(folder, "mesh")
	if err := errors.Join(os.Rename(record, record+".elsewhere"), os.Symlink(record+".elsewhere", record)); err != nil {
		t.Fatal(err)
	}
	_, err = stellate.NewMesh(context.Background(), torus, 0.3, options)
	if !errors.Is(err, stellate.ErrInvalidArgument) || !strings.Contains(err.Error(), "mesh is a link") {
		t.Error(err)
	}
}
