// Conform obeys `stellate conform`, whose help says what each line wants.
package main

import (
	"bufio"
	"context"
	"errors"
	"fmt"
	"log"
	"os"
	"strconv"
	"strings"

	"stellate"
	pb "stellate/proto/v1"
)

// name is an enumerator without its prefix, or UNKNOWN, which a newer server's is.
func name[Enum ~int32](value Enum, known map[int32]string, prefix string) string {
	if said, is := known[int32(value)]; is {
		return strings.TrimPrefix(said, prefix)
	}
	return "UNKNOWN"
}

func connect(token string) (*stellate.Client, error) {
	quiet := func(string) {}
	credentials := stellate.Credentials{Token: token}
	return stellate.NewClient(stellate.Connection{Server: os.Args[1], OnOutage: quiet, Credentials: credentials})
}

func serve(ctx context.Context, client *stellate.Client, mesh, what string) (string, error) {
	oracle := manifold(what)
	if oracle == nil {
		return "unsupported", nil
	}
	state, err := client.Serve(ctx, oracle, mesh, stellate.WorkerOptions{})
	return "over " + state, err
}

func watch(ctx context.Context, client *stellate.Client, mesh, path string) (string, error) {
	var last *stellate.Mesh
	var err error
	for grown, failed := range client.Watch(ctx, mesh, nil) {
		last, err = grown, failed
	}
	var ours *stellate.Error
	if errors.As(err, &ours) && ours.Kind == stellate.ErrCancelled && ours.Mesh != nil {
		last, err = ours.Mesh, nil
	}
	if err == nil {
		err = last.Save(path)
	}
	if err == nil && last.Walls != nil {
		var lines strings.Builder
		for _, bits := range last.Walls {
			fmt.Fprintln(&lines, bits)
		}
		err = os.WriteFile(path+".walls", []byte(lines.String()), 0o644)
	}
	if err != nil {
		return "", err
	}
	return fmt.Sprint("mesh ", last.Revision, " ", ended(last)), nil
}

func ended(mesh *stellate.Mesh) string {
	return name(mesh.Report.GetTermination(), pb.Termination_name, "TERMINATION_") +
		" " + name(mesh.Report.GetCertificate().GetLevel(), pb.CertificateLevel_name, "CERTIFICATE_LEVEL_")
}

func create(ctx context.Context, label, how string) (string, error) {
	token, hasToken := strings.CutPrefix(how, "token=")
	if !hasToken {
		token = ""
	}
	client, err := connect(token)
	if err != nil {
		return "", err
	}
	defer client.Close()
	options := stellate.Options{Label: label}
	var oracle stellate.Oracle = torus
	switch how {
	case "seeds":
		oracle = seeded{torus, torus}
	case "walls":
		oracle = lune{}
	}
	mesh, err := client.Create(ctx, oracle, 0.5, &options)
	return "created " + mesh.GetName(), err
}

func reconstruct(ctx context.Context, path, k, d string) (string, error) {
	text, err := os.ReadFile(path)
	if err != nil {
		return "", err
	}
	cloud := stellate.PointCloud{}
	cloud.Dimension, _ = strconv.Atoi(k)
	cloud.AmbientDimension, _ = strconv.Atoi(d)
	for _, word := range strings.Fields(string(text)) {
		x, err := strconv.ParseFloat(word, 64)
		if err != nil {
			return "", err
		}
		cloud.Points = append(cloud.Points, x)
	}
	options := stellate.ReconstructOptions{}
	options.Server, options.OnOutage = os.Args[1], func(string) {}
	mesh, err := stellate.Reconstruct(ctx, cloud, &options)
	if err != nil {
		return "", err
	}
	return fmt.Sprint("mesh - ", ended(mesh)), nil
}

func obey(client *stellate.Client, words []string) (string, error) {
	ctx := context.Background()
	words = append(words, "", "", "")
	switch words[0] {
	case "serve":
		return serve(ctx, client, words[1], words[2])
	case "watch":
		return watch(ctx, client, words[1], words[2])
	case "create":
		return create(ctx, words[1], words[2])
	case "reconstruct":
		return reconstruct(ctx, words[1], words[2], words[3])
	case "save":
		mesh, err := stellate.LoadTxt(words[1])
		if err == nil {
			err = mesh.Save(words[2])
		}
		return "saved", err
	}
	return "unsupported", nil
}

func main() {
	client, err := connect("")
	if err != nil {
		log.Fatal(err)
	}
	defer client.Close()
	for in := bufio.NewScanner(os.Stdin); in.Scan(); {
		answer, err := obey(client, strings.Fields(in.Text()))
		var ours *stellate.Error
		if errors.As(err, &ours) {
			kind := strings.ReplaceAll(ours.Kind.Error(), " ", "")
			answer = fmt.Sprint("error ", kind, " ", ours.Reason, " ", strings.ReplaceAll(ours.Error(), "\n", " "))
		} else if err != nil {
			answer = "error oracle RAISED " + err.Error()
		}
		fmt.Println(answer)
	}
}
