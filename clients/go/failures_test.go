package stellate_test

import (
	"context"
	"errors"
	"math"
	"os"
	"slices"
	"strings"
	"sync"
	"testing"

	"stellate"
)

// spoilt is a torus whose answers are spoilt after a while.
type spoilt struct {
	stellate.Torus
	asked *int
	spoil func(points []float64) error
}

func (s spoilt) ClosestPoint(x, points []float64, found []bool) error {
	if err := s.Torus.ClosestPoint(x, points, found); err != nil {
		return err
	}
	if *s.asked += len(found); *s.asked > 300 {
		return s.spoil(points)
	}
	return nil
}

func (spoilt) ConcurrencySafe() bool { return false }

func TestRefusals(t *testing.T) {
	to := server(t)
	_, err := stellate.NewMesh(context.Background(), torus, -1, &stellate.Options{Connection: to})
	var ours *stellate.Error
	if !errors.As(err, &ours) || !errors.Is(err, stellate.ErrInvalidArgument) || ours.Reason != "INVALID_ARGUMENT" {
		t.Fatal(err)
	}
	if len(ours.Fields) != 1 || !strings.Contains(err.Error(), "epsilon") {
		t.Error(ours.Fields, err)
	}
	nobody := "meshes/" + strings.Repeat("0", 32)
	c := client(t, to)
	if _, err := c.Get(context.Background(), nobody); !errors.Is(err, stellate.ErrMeshNotFound) {
		t.Error(err)
	}
	if _, err := c.Serve(context.Background(), torus, nobody, stellate.WorkerOptions{}); !errors.Is(err, stellate.ErrMeshNotFound) {
		t.Error(err)
	}
}

func TestErrorsOfTheOracle(t *testing.T) {
	to := server(t)
	mine := errors.New("no such surface")
	for reason, spoil := range map[string]func([]float64) error{
		"":                  func([]float64) error { return mine },
		"ORACLE_NOT_FINITE": func(points []float64) error { points[0] = math.NaN(); return nil },
		"ORACLE_BAD_TANGENT": func(points []float64) error {
			for i := range points {
				points[i] *= 1.1
			}
			return nil
		},
	} {
		_, err := meshed(to, spoilt{torus, new(int), spoil})
		var ours *stellate.Error
		if reason == "" {
			if err != mine { //nolint:errorlint // as itself
				t.Error(err)
			}
		} else if !errors.As(err, &ours) || ours.Reason != reason || !errors.Is(err, stellate.ErrOracle) {
			t.Error(reason, err)
		}
	}
}

func TestAnotherManifoldLeavesTheMeshAlone(t *testing.T) {
	ctx := context.Background()
	c := client(t, server(t))
	info, err := c.Create(ctx, torus, 0.1, nil)
	if err != nil {
		t.Fatal(err)
	}
	_, err = c.Serve(ctx, stellate.ProductOfCircles{K: 2}, info.GetName(), stellate.WorkerOptions{})
	if !errors.Is(err, stellate.ErrInvalidArgument) {
		t.Error(err)
	}
	state, err := c.Serve(ctx, torus, info.GetName(), stellate.WorkerOptions{})
	if state != "SUCCEEDED" || err != nil {
		t.Error(state, err)
	}
}

func TestServerThatComesBack(t *testing.T) {
	torusCounts, _ := expected(t)
	address, restart, end := restartingServer(t)
	var once, mutex sync.Mutex
	var said []string
	killed := false
	oracle := spoilt{torus, new(int), func([]float64) error {
		once.Lock()
		defer once.Unlock()
		if !killed {
			killed = true
			restart()
		}
		return nil
	}}
	mesh, err := meshed(stellate.Connection{Server: address, OnOutage: func(line string) {
		mutex.Lock()
		defer mutex.Unlock()
		said = append(said, line)
	}}, oracle)
	if err != nil {
		t.Fatal(err)
	}
	if counts(mesh) != torusCounts || !mesh.Certified() {
		t.Error(counts(mesh))
	}
	for _, words := range []string{"lost the server", "the server is back"} {
		if !slices.ContainsFunc(said, func(line string) bool { return strings.HasPrefix(line, words) }) {
			t.Errorf("%q is not among %q", words, said)
		}
	}
	end()
	if _, err := meshed(stellate.Connection{Server: address}, torus); !errors.Is(err, stellate.ErrUnavailable) {
		t.Error(err)
	}
}

func TestTLSAndToken(t *testing.T) {
	address, _, _ := restartingServer(t, "--tls-cert", secret(t, "proxy.pem"), "--tls-key", secret(t, "proxy.pem"),
		"--token-file", secret(t, "tokens"))
	said, err := os.ReadFile(secret(t, "me.token"))
	if err != nil {
		t.Fatal(err)
	}
	ca, token := secret(t, "ca.pem"), strings.TrimSpace(string(said))
	for _, one := range []struct {
		credentials stellate.Credentials
		kind        error
	}{
		{stellate.Credentials{CA: ca, Token: token}, nil},
		{stellate.Credentials{CA: ca}, stellate.ErrUnauthenticated},
		{stellate.Credentials{CA: ca, Token: "guessed"}, stellate.ErrUnauthenticated},
		{stellate.Credentials{TLS: true, Token: token}, stellate.ErrUnavailable},
	} {
		_, err := meshed(stellate.Connection{Server: address, Credentials: one.credentials}, torus)
		if !errors.Is(err, one.kind) {
			t.Error(one.kind, err)
		}
		if one.kind == stellate.ErrUnauthenticated && !strings.Contains(err.Error(), "give a token") {
			t.Error(err)
		}
	}
	_, err = stellate.NewClient(stellate.Connection{
		Server: "mesh.example.org:7717", Credentials: stellate.Credentials{Token: "secret"}})
	if !errors.Is(err, stellate.ErrInvalidArgument) {
		t.Error("a token in plain text", err)
	}
}
