{{/* Labels of every object; those of a pod are `stellate.labels` alone. */}}
{{- define "stellate.labels" -}}
app.kubernetes.io/name: {{ . }}
app.kubernetes.io/part-of: stellate
{{- end }}

{{- define "stellate.release" -}}
helm.sh/chart: {{ .Chart.Name }}-{{ .Chart.Version }}
app.kubernetes.io/managed-by: {{ .Release.Service }}
app.kubernetes.io/instance: {{ .Release.Name }}
app.kubernetes.io/version: {{ .Chart.AppVersion | quote }}
{{- end }}

{{/* (list root image): its whole name. */}}
{{- define "stellate.image" -}}
{{- $root := index . 0 }}{{ $image := index . 1 -}}
{{- if $image.digest }}{{ $image.repository }}@{{ $image.digest }}
{{- else }}{{ $image.repository }}:{{ $image.tag | default $root.Chart.AppVersion }}{{ end }}
{{- end }}

{{/* What all pods have: root. */}}
{{- define "stellate.pod" -}}
automountServiceAccountToken: false
enableServiceLinks: false
{{- with .Values.images.pullSecrets }}
imagePullSecrets:
{{- range . }}
  - name: {{ . }}
{{- end }}
{{- end }}
{{- with .Values.nodeSelector }}
nodeSelector: {{- toYaml . | nindent 2 }}
{{- end }}
{{- with .Values.tolerations }}
tolerations: {{- toYaml . | nindent 2 }}
{{- end }}
{{- end }}

{{- define "stellate.user" -}}
runAsNonRoot: true
runAsUser: 65532
runAsGroup: 65532
seccompProfile:
  type: RuntimeDefault
{{- end }}

{{/* A name: its pods on different nodes, where there are some. */}}
{{- define "stellate.apart" -}}
podAntiAffinity:
  preferredDuringSchedulingIgnoredDuringExecution:
    - weight: 100
      podAffinityTerm:
        topologyKey: kubernetes.io/hostname
        labelSelector:
          matchLabels:
            app.kubernetes.io/name: {{ . }}
{{- end }}

{{- define "stellate.confined" -}}
allowPrivilegeEscalation: false
readOnlyRootFilesystem: true
capabilities:
  drop: [ALL]
{{- end }}

{{/* (list root mode file...): the volume of these files. One secret as it is, several projected into one folder. */}}
{{- define "stellate.secrets" -}}
{{- $root := index . 0 }}{{ $mode := index . 1 }}{{ $places := list }}{{ $names := list -}}
{{- range slice . 2 }}
  {{- $there := get $root.Values.secrets.files . | default dict }}
  {{- $name := $there.secret | default $root.Values.secrets.name }}
  {{- $names = append $names $name }}
  {{- $places = append $places (dict "secret" $name "key" ($there.key | default .) "path" .) }}
{{- end }}
{{- if eq 1 (len (uniq $names)) -}}
secret:
  secretName: {{ first $names }}
  defaultMode: {{ $mode }}
  items:
{{- range $places }}
    - {key: {{ .key }}, path: {{ .path }}}
{{- end }}
{{- else -}}
projected:
  defaultMode: {{ $mode }}
  sources:
{{- range $places }}
    - secret:
        name: {{ .secret }}
        items:
          - {key: {{ .key }}, path: {{ .path }}}
{{- end }}
{{- end }}
{{- end }}

{{/* Where clients and workers go. */}}
{{- define "stellate.wayIn" -}}
{{ ternary "proxy" "stellated" .Values.proxy.enabled }}
{{- end }}

{{- define "stellate.names" -}}
- to:
    - namespaceSelector:
        matchLabels:
          kubernetes.io/metadata.name: kube-system
      podSelector:
        matchLabels:
          k8s-app: kube-dns
  ports:
    - {port: 53, protocol: UDP}
    - {port: 53, protocol: TCP}
{{- end }}

{{/* (list root name replicas): a budget, where one pod may go and others stay. */}}
{{- define "stellate.oneAtATime" -}}
{{- $root := index . 0 }}{{ $name := index . 1 -}}
---
apiVersion: policy/v1
kind: PodDisruptionBudget
metadata:
  name: {{ $name }}
  namespace: {{ $root.Release.Namespace }}
  labels: {{- include "stellate.release" $root | nindent 4 }}
spec:
  maxUnavailable: 1
  selector:
    matchLabels:
      app.kubernetes.io/name: {{ $name }}
{{- end }}
