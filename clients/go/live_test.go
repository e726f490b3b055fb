package stellate_test

import (
	"bufio"
	"context"
	"io"
	"os"
	"os/exec"
	"path/filepath"
	"strings"
	"testing"

	"fmt"

	"stellate"
)

// fromEnvironment is what tests/languages/run sets.
func fromEnvironment(t *testing.T, name string) string {
	t.Helper()
	value := os.Getenv(name)
	if value == "" {
		t.Fatalf("tests/languages/run sets %s", name)
	}
	return value
}

// expected are the vertices and simplices of the torus and of the Clifford torus, as Python has them.
func expected(t *testing.T) (torus, clifford [2]int) {
	t.Helper()
	_, err := fmt.Sscan(fromEnvironment(t, "STELLATE_TEST_COUNTS"), &torus[0], &torus[1], &clifford[0], &clifford[1])
	if err != nil {
		t.Fatal(err)
	}
	return torus, clifford
}

// hemisphereCounts are those of a half sphere of epsilon 0.2.
func hemisphereCounts(t *testing.T) (counts [2]int) {
	t.Helper()
	_, err := fmt.Sscan(fromEnvironment(t, "STELLATE_TEST_HEMISPHERE"), &counts[0], &counts[1])
	if err != nil {
		t.Fatal(err)
	}
	return counts
}

// server is a stellated for one test.
func server(t *testing.T) stellate.Connection {
	t.Helper()
	own, err := stellate.StartServer(stellate.ServerOptions{})
	if err != nil {
		t.Fatal(err)
	}
	t.Cleanup(func() { own.Close() })
	return stellate.Connection{Own: own}
}

func client(t *testing.T, to stellate.Connection) *stellate.Client {
	t.Helper()
	c, err := stellate.NewClient(to)
	if err != nil {
		t.Fatal(err)
	}
	t.Cleanup(func() { c.Close() })
	return c
}

// restartingServer can be killed and started again, by a line.
func restartingServer(t *testing.T, flags ...string) (address string, restart func(), end func()) {
	t.Helper()
	command := exec.Command(fromEnvironment(t, "STELLATE_TEST_RESTARTING_SERVER"), flags...)
	in, _ := command.StdinPipe()
	out, _ := command.StdoutPipe()
	if err := command.Start(); err != nil {
		t.Fatal(err)
	}
	line, err := bufio.NewReader(out).ReadString('\n')
	if err != nil {
		t.Fatal(err)
	}
	end = func() { in.Close(); _ = command.Wait() }
	t.Cleanup(end)
	return strings.TrimSpace(line), func() { _, _ = io.WriteString(in, "\n") }, end
}

var torus = stellate.Torus{Major: 1, Minor: 0.4}

func counts(mesh *stellate.Mesh) [2]int { return [2]int{mesh.VertexCount(), mesh.SimplexCount()} }

// meshed is the torus, or something like it.
func meshed(to stellate.Connection, oracle stellate.Oracle) (*stellate.Mesh, error) {
	return stellate.NewMesh(context.Background(), oracle, 0.1, &stellate.Options{Connection: to})
}

func secret(t *testing.T, name string) string {
	t.Helper()
	return filepath.Join(fromEnvironment(t, "STELLATE_TEST_SECRETS"), name)
}
