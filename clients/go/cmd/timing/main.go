// Timing meshes the torus for every line "EPSILON" on standard input, on the server that it is given,
// and prints "SECONDS VERTICES SIMPLICES".
package main

import (
	"context"
	"fmt"
	"log"
	"os"
	"time"

	"stellate"
)

func main() {
	client, err := stellate.NewClient(stellate.Connection{Server: os.Args[1]})
	if err != nil {
		log.Fatal(err)
	}
	defer client.Close()
	options := &stellate.Options{Connection: stellate.Connection{Client: client}}
	for {
		var epsilon float64
		if _, err := fmt.Scanln(&epsilon); err != nil {
			return
		}
		begin := time.Now()
		mesh, err := stellate.NewMesh(context.Background(), stellate.Torus{Major: 1, Minor: 0.4}, epsilon, options)
		if err != nil {
			log.Fatal(err)
		}
		fmt.Println(time.Since(begin).Seconds(), mesh.VertexCount(), mesh.SimplexCount())
	}
}
