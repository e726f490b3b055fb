// Quickstart meshes a torus through an oracle of its own, and writes torus.obj and torus.txt.
package main

import (
	"context"
	"flag"
	"fmt"
	"log"
	"math"
	"os"
	"os/signal"
	"path/filepath"

	"stellate"
)

const major, minor = 1.0, 0.4

type torus struct{}

func (torus) Dimension() int        { return 2 }
func (torus) AmbientDimension() int { return 3 }

func (torus) BoundingBox() (lower, upper []float64) {
	return []float64{-1.5, -1.5, -0.5}, []float64{1.5, 1.5, 0.5}
}

func (torus) ClosestPoint(x, points []float64, found []bool) error {
	for i := 0; i < len(x); i += 3 {
		ring := math.Hypot(x[i], x[i+1])
		tube := math.Hypot(ring-major, x[i+2])
		scale := (major + minor*(ring-major)/tube) / ring
		points[i], points[i+1], points[i+2] = x[i]*scale, x[i+1]*scale, minor*x[i+2]/tube
	}
	return nil
}

func main() {
	epsilon := flag.Float64("epsilon", 0.1, "largest circumradius of a triangle")
	folder := flag.String("o", ".", "where to write torus.obj and torus.txt")
	flag.Parse()
	ctx, stop := signal.NotifyContext(context.Background(), os.Interrupt)
	defer stop()
	options := &stellate.Options{OnProgress: stellate.ProgressBar(os.Stderr)}
	mesh, err := stellate.NewMesh(ctx, torus{}, *epsilon, options)
	if err != nil {
		log.Fatal(err)
	}
	fmt.Print(mesh.Report.GetText())
	for _, name := range []string{"torus.obj", "torus.txt"} {
		if err := mesh.Save(filepath.Join(*folder, name)); err != nil {
			log.Fatal(err)
		}
	}
	if !mesh.Certified() {
		os.Exit(1)
	}
}
